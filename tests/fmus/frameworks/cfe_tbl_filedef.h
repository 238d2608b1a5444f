#define CFE_TBL_FILEDEF(ObjName, TblName, Desc, Filename) const char *const table_names[] = {#ObjName, #TblName, #Desc, #Filename};
